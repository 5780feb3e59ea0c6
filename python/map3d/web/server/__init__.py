"""Runs the app: composes all routes, calls view functions, measures, logs and answers errors."""
