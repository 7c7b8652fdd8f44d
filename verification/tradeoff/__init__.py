"""What each knob buys: speed against accuracy, over scenes with closed forms and with limits of their finest runs."""
