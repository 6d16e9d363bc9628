"""What each vehicle does: routes and their timing, transits, allocation, directors, the PLAN file."""
