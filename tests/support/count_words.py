"""How long the documentation is and how long its sentences are: `python tests/support/count_words.py`."""

from __future__ import annotations

import statistics

from pages import ROOT, WRITTEN, sentences, words


def main() -> None:
    """Print words of prose and all words of each page, and the lengths of all sentences."""
    lengths = list[int]()
    total = 0
    for page in WRITTEN:
        text = page.read_text("utf-8")
        own = [len(words(sentence)) for sentence in sentences(text)]
        print(f"{sum(own):6} {len(text.split()):6}  {page.relative_to(ROOT).as_posix()}")
        lengths += own
        total += len(text.split())
    print(f"{sum(lengths):6} {total:6}  words of prose, and with tables and code, of {len(WRITTEN)} pages")
    median, ninth = statistics.median(lengths), statistics.quantiles(lengths, n=10)[-1]
    print(f"words of a sentence: median {median:.0f}, 90th percentile {ninth:.0f}, longest {max(lengths)}")


if __name__ == "__main__":
    main()
