"""One pipeline on several machines: the link, who is at its other end, and whom one may trust."""
