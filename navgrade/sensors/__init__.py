"""What a real IMU adds to the truth."""
