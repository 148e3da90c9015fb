"""Learning to see: pictures that the simulator draws and labels, and the training of the network that reads them."""
