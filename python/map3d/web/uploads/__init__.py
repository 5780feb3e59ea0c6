"""The upload route (tus protocol)."""
