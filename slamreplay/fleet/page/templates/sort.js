// Tables sort by their columns: numbers once from the highest, once more from the lowest, names the
// other way round. Without this script they stand in the order of what is worst.
const names = new Intl.Collator(undefined, { numeric: true });

const isNumber = (cell) => cell.dataset.by !== undefined;
const isKnown = (cell) => cell.dataset.by !== '';

function compare(a, b) {
  if (isNumber(a)) return Number(a.dataset.by) - Number(b.dataset.by);
  return names.compare(a.textContent, b.textContent);
}

function sort(table, head, column) {
  const body = table.tBodies[0], rows = [...body.rows], first = rows[0].cells[column];
  const before = head.getAttribute('aria-sort') ?? (isNumber(first) ? 'ascending' : 'descending');
  const order = before === 'ascending' ? 'descending' : 'ascending';
  for (const other of head.parentElement.cells) other.removeAttribute('aria-sort');
  head.setAttribute('aria-sort', order);
  const known = rows.filter((row) => isKnown(row.cells[column])); // what is not stays below
  known.sort((a, b) => (order === 'ascending' ? 1 : -1) * compare(a.cells[column], b.cells[column]));
  body.append(...known, ...rows.filter((row) => !known.includes(row)));
}

for (const table of document.querySelectorAll('table.sortable')) {
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    if ('still' in head.dataset) return;
    const button = document.createElement('button');
    button.type = 'button';
    button.textContent = head.textContent;
    button.addEventListener('click', () => sort(table, head, column));
    head.replaceChildren(button);
  });
}
