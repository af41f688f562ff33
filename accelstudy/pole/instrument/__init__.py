"""The pole and the calibrated sensor on it: quantities, geometry, bending, attitudes."""
