"""The same work by Kappaskin and by what one would use instead, side by side."""
