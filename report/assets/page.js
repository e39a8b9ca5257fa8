'use strict';
// Columns sort on a click: numbers by their exact value (data-v), text by itself; cells without a number go last.
for (const table of document.querySelectorAll('table')) {
  const body = table.tBodies[0];
  if (!body || body.rows.length < 2) continue;
  const heads = Array.from(table.tHead.rows[0].cells);
  heads.forEach((head, column) => {
    // Not a button element: browsers do not print those in the repeated heads of long tables.
    const button = head.querySelector('span');
    button.setAttribute('role', 'button');
    button.tabIndex = 0;
    button.addEventListener('keydown', (event) => {
      if (event.key !== 'Enter' && event.key !== ' ') return;
      event.preventDefault();
      button.click();
    });
    head.setAttribute('aria-sort', 'none');
    button.addEventListener('click', () => {
      const descending = head.getAttribute('aria-sort') === 'ascending';
      heads.forEach((other) => other.setAttribute('aria-sort', 'none'));
      head.setAttribute('aria-sort', descending ? 'descending' : 'ascending');
      const key = (row) => {
        const cell = row.cells[column];
        const value = Number(cell.dataset.v === undefined ? NaN : cell.dataset.v);
        return { value, text: cell.textContent };
      };
      const compare = (a, b) => {
        const numbers = Number.isFinite(a.value) ? 1 : 0;
        if (numbers !== (Number.isFinite(b.value) ? 1 : 0)) return numbers ? -1 : 1;
        const order = numbers ? a.value - b.value : a.text.localeCompare(b.text, 'en', { numeric: true });
        return descending ? -order : order;
      };
      const rows = Array.from(body.rows, (row) => ({ row, key: key(row) }));
      rows.sort((a, b) => compare(a.key, b.key));
      body.append(...rows.map((entry) => entry.row));
    });
  });
}
// Figures that are wider than a narrow screen scroll sideways, with the keyboard too.
function reach(figure) {
  if (figure.scrollWidth > figure.clientWidth) figure.tabIndex = 0;
  else figure.removeAttribute('tabindex');
}
for (const figure of document.querySelectorAll('figure')) {
  if (typeof ResizeObserver === 'function') new ResizeObserver(() => reach(figure)).observe(figure);
  reach(figure);
}
