"""Motions over the WGS-84 Earth, and what an ideal IMU feels on them."""
