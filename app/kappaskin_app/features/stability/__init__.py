"""Observability of shapes, and hard cases."""
