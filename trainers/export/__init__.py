"""Policies as files to share."""
