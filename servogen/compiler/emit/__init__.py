"""From the intermediate form to words: delays, frames, addresses, the listing."""
