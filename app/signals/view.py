"""Completions for expressions, sent to the page that requested them."""

from __future__ import annotations

from dataclasses import asdict

from ..core.views import Place, news

VIEWS = (Place(news("hint", asdict), 98),)
