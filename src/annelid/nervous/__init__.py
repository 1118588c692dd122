"""Neurons, synapses, networks and the paper's peristalsis network; knows no engine and no body."""
