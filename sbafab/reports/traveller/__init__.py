"""traveller.html: the technician's page for the laser and the press."""
