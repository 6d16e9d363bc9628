"""Triage: UGVs search, a UAV relays, a medic treats."""
