"""Engines of others that replay a recorded run, each behind one protocol and imported where it is used."""
