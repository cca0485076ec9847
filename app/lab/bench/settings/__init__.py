"""Settings that trade time or size for error: in trainings and in exports."""
