"""Import designs of drawn layers from drawings, folders, laminates and circuits."""
