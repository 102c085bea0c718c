"""What drives the chip's inputs on the bench: a Firmata board, and a USB serial adapter."""
