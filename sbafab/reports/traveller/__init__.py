"""traveller.html: what the technician has at the laser and the press."""
