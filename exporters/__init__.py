"""How it leaves: autopilot and ECDIS files, the recording, pictures."""
