"""Reports: self-contained HTML pages, and summaries for the terminal."""
