"""The figures of the papers, drawn from runs of this program on simulated recordings: `./run accuracy --figures`."""
