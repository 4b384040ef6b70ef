"""What acts: force laws and controllers, from what a user writes to the generalised forces."""
