"""traveller.html: the technician's page at the laser and the press."""
