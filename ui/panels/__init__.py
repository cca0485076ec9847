"""One file per panel: functions that read the session and send commands."""
