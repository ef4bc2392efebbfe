"""Estimates published to other programs."""
