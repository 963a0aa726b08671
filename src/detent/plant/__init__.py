"""What moves: motors, friction, transmissions, frames and other loads."""
