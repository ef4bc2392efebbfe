"""Views show what they are given and say what a person wishes; they never change anything."""
