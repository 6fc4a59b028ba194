// Tables sort by their columns: once from the highest, once more from the lowest. Without this
// script they stand in the order of what is worst.
const words = new Intl.Collator(undefined, { numeric: true });

function compare(a, b) {
  if (a === '' || b === '') return (a === '') - (b === ''); // what is not known stays below
  const difference = Number(b) - Number(a);
  return Number.isNaN(difference) ? words.compare(a, b) : difference;
}

function sort(table, head, column) {
  const again = head.getAttribute('aria-sort') === 'descending';
  for (const other of head.parentElement.children) other.removeAttribute('aria-sort');
  head.setAttribute('aria-sort', again ? 'ascending' : 'descending');
  const body = table.tBodies[0];
  const value = (row) => row.children[column].dataset.by ?? row.children[column].textContent.trim();
  const known = [...body.rows].filter((row) => value(row) !== '');
  const unknown = [...body.rows].filter((row) => value(row) === '');
  known.sort((a, b) => (again ? -1 : 1) * compare(value(a), value(b)));
  body.append(...known, ...unknown);
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
