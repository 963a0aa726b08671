"""From a drive value to motor terminals: PWM timer, decoder, bridge."""
