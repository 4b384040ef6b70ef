"""What one concludes: order, drift, cards, figures, replay."""
