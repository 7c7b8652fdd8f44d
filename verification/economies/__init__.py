"""What each economy saves, off against on: domain, cells, plane strain, subdomains, increments and stages."""
