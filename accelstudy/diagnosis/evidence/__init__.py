"""What the residuals say of each hypothesis, and what noise alone would say."""
