"""The skin in three dimensions."""
