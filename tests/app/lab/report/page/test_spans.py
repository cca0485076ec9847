"""Numbers in few words, and tables and lists that stay short however long the capture is."""

from __future__ import annotations

import pytest

from app.lab.report.page.tables import MAX_FIRST_ROWS, MAX_LAST_ROWS, Table, TableColumn
from app.spans import MAX_SPANS, spans_text
from tests.app.lab.report.made_up import Page


@pytest.mark.parametrize(
    ("numbers", "text"),
    [
        ([], ""),
        ([4], "4"),
        ([0, 1], "0, 1"),
        ([0, 3, 4, 5, 9], "0, 3 to 5, 9"),
        (range(1000), "0 to 999"),
        (range(0, 300, 2), ", ".join(map(str, range(0, 2 * MAX_SPANS, 2))) + " and 130 more"),
    ],
)
def test_runs_of_numbers(numbers, text):
    assert spans_text(list(numbers)) == text


def test_of_many_rows_the_page_shows_the_first_and_the_last_and_the_file_all():
    most = MAX_FIRST_ROWS + MAX_LAST_ROWS
    column = TableColumn("n", "N", is_higher_better=True)

    def shown(n_rows: int) -> tuple[Table, Page]:
        table = Table("t", "Numbers", [column], [{"n": i} for i in range(n_rows)])
        return table, Page(table.markup())

    _, page = shown(most)
    assert len(page.tables["t"]) == most
    assert "tables/t.csv" not in page.text
    table, page = shown(3 * most)
    cells = [row[0] for row in page.tables["t"]]
    assert cells[: MAX_FIRST_ROWS + 1] == [*map(str, range(MAX_FIRST_ROWS)), str(3 * most - MAX_LAST_ROWS)]
    assert len(cells) == most
    assert f"the last {MAX_LAST_ROWS} of {3 * most} rows; all of them are in tables/t.csv" in page.text
    assert len(table.document()["rows"]) == 3 * most
    assert len(table.csv_text().splitlines()) == 3 * most + 1


def test_a_column_may_stand_in_files_only():
    columns = [TableColumn("a", "A"), TableColumn("b", "B", is_shown=False)]
    table = Table("t", "Two", columns, [{"a": 1, "b": 2}])
    assert Page(table.markup()).tables["t"] == [["1"]]
    assert table.csv_text().splitlines() == ["a,b", "1,2"]
