"""What all figures share: colours, symbols and sizes, and how they are saved."""
