"""What a run gives: tracks made ready for the equations, with their noise taken off."""
