"""What happens to a capture before training: opening, calibration, synchronisation, the doctor."""
