"""Runs the app: composes all routes, reads bodies, measures, logs and answers errors."""
