"""Helpers without a concept of their own."""
