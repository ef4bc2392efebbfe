"""The pages of the lessons' panel."""
