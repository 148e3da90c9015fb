"""Published policies: a file with the weights, and a card."""
