"""Lessons: read from files, judged by what the window shows, played on it."""
