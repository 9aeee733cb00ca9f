"""What people read of a fit: text, HTML, and tables of several fits."""
