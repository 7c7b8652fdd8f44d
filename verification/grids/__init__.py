"""What a grid costs at equal error: regular, boxes of small cells, cells that follow walls and failed rock."""
