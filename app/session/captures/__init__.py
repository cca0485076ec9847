"""Steps before training a capture: opening, calibration, synchronisation, the doctor."""
