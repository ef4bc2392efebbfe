"""Files for other programs: tables, pictures, films, figures, scripts."""
