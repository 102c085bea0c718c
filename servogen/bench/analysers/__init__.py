"""Logic analysers: SUMP, sigrok, and captures longer than their memory."""
