"""Designs of drawn layers from what others wrote: drawings, folders, laminates, circuits."""
