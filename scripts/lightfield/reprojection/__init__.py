"""The same views through other lenses: lens maps, filters, colour and depth."""
