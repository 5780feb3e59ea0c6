"""Builds 3D models of planned buildings and trees."""
