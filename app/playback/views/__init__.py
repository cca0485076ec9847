"""Views: where a picture is seen from, and how that moves."""
