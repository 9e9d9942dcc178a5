"""Rendering of the dashboard's pages, cells and cards."""
