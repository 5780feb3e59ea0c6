"""Previews: small pictures and estimates of a view before its rendering exists."""
