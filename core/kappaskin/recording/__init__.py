"""Recordings: MCAP files of messages that other programs know, written while live."""
