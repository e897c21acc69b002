//! A curve of any length in bounded memory: per column of time its first, lowest, highest and last
//! value. A picture that is narrower than the columns are many looks the same as one of all values.

/// The most columns that are kept: twice the pixels of a wide screen, so that after the last time
/// two columns became one there is still one for each pixel.
const MOST: usize = 4096;

/// A value at a place on the axis: microseconds, or a byte offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Point {
    pub(super) x: u64,
    pub(super) y: f64,
}

/// The values of one column.
#[derive(Clone, Copy, Debug)]
struct Column {
    key: u64,
    first: Point,
    low: Point,
    high: Point,
    last: Point,
    /// How many they are.
    count: u64,
    /// The curve is interrupted in front of this column.
    is_cut: bool,
    /// How far the last value holds, if it has ended.
    end: Option<u64>,
}

/// A curve.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    /// A column is this power of two wide.
    shift: u32,
    columns: Vec<Column>,
    /// The curve is interrupted in front of the next value.
    is_cut: bool,
}

impl Column {
    const fn of(key: u64, point: Point, is_cut: bool) -> Self {
        let [first, low, high, last] = [point; 4];
        Self { key, first, low, high, last, count: 1, is_cut, end: None }
    }

    /// Takes in a column beside it, or the same one again. Of values at the same place, those of
    /// `later` are the later ones.
    fn join(&mut self, later: &Self) {
        if later.first.x < self.first.x {
            self.first = later.first;
        }
        if later.last.x >= self.last.x {
            (self.last, self.end) = (later.last, later.end);
        }
        if later.low.y < self.low.y {
            self.low = later.low;
        }
        if later.high.y > self.high.y {
            self.high = later.high;
        }
        self.count += later.count;
    }

    /// Its points from left to right, each once.
    fn points(&self) -> impl Iterator<Item = Point> {
        let mut inner = [self.low, self.high];
        inner.sort_by_key(|point| point.x);
        let [one, two] = inner;
        let all = [Some(self.first), Some(one), Some(two), Some(self.last)];
        let mut before: Option<Point> = None;
        all.into_iter().flatten().filter(move |point| before.replace(*point) != Some(*point))
    }
}

impl Columns {
    /// Takes in a value. One that is not finite interrupts the curve.
    pub(super) fn push(&mut self, x: u64, y: f64) {
        if !y.is_finite() {
            return self.cut();
        }
        let is_cut = core::mem::take(&mut self.is_cut);
        let new = Column::of(x >> self.shift, Point { x, y }, is_cut);
        match self.columns.last_mut() {
            Some(last) if last.key == new.key => last.join(&new),
            Some(last) if last.key > new.key => self.insert(&new),
            _ => self.columns.push(new),
        }
        while self.columns.len() > MOST {
            self.widen();
        }
    }

    /// The curve is interrupted here.
    pub(super) const fn cut(&mut self) {
        self.is_cut = !self.columns.is_empty();
    }

    /// The last value holds until here, and no longer.
    pub(super) fn end(&mut self, x: u64) {
        if let Some(last) = self.columns.last_mut().filter(|_| !self.is_cut) {
            last.end = Some(x);
        }
        self.cut();
    }

    /// A value of a time before that of the last: the clock of the capture was set back.
    fn insert(&mut self, new: &Column) {
        match self.columns.binary_search_by_key(&new.key, |column| column.key) {
            Ok(at) => self.columns.get_mut(at).into_iter().for_each(|column| column.join(new)),
            Err(at) => self.columns.insert(at, *new),
        }
    }

    /// Makes each two columns one.
    fn widen(&mut self) {
        self.shift += 1;
        let mut wide: Vec<Column> = Vec::with_capacity(MOST + 1);
        for column in &self.columns {
            let key = column.key >> 1;
            match wide.last_mut() {
                // What is interrupted inside of a column is not seen any more.
                Some(last) if last.key == key => last.join(column),
                _ => wide.push(Column { key, ..*column }),
            }
        }
        self.columns = wide;
    }

    /// Whether the curve is interrupted behind its last value.
    pub(super) const fn is_ended(&self) -> bool {
        self.is_cut
    }

    pub(super) const fn is_empty(&self) -> bool {
        self.columns.is_empty()
    }

    /// Width of a column, in units of the axis: 1 if every value is there that has a place of its
    /// own.
    pub(super) const fn width(&self) -> u64 {
        1 << self.shift
    }

    /// Number of all values, those that the columns leave out too.
    pub(super) fn count(&self) -> u64 {
        self.columns.iter().map(|column| column.count).sum()
    }

    /// The last value.
    pub(super) fn last(&self) -> Option<Point> {
        self.columns.last().map(|column| column.last)
    }

    /// Lowest and highest value.
    pub(super) fn range(&self) -> Option<(f64, f64)> {
        let lows = self.columns.iter().map(|column| column.low.y).reduce(f64::min);
        let highs = self.columns.iter().map(|column| column.high.y).reduce(f64::max);
        lows.zip(highs)
    }

    /// The points of the curve, in pieces without an interruption.
    pub(super) fn pieces(&self) -> impl Iterator<Item = Vec<Point>> {
        self.pieces_and_ends().map(|(piece, _)| piece)
    }

    /// The same, and how far the last value of each holds, if it has ended.
    pub(super) fn pieces_and_ends(&self) -> impl Iterator<Item = (Vec<Point>, Option<u64>)> {
        let mut rest = &*self.columns;
        core::iter::from_fn(move || {
            let (first, others) = rest.split_first()?;
            let len = others.iter().take_while(|column| !column.is_cut).count();
            let (piece, behind) = others.split_at_checked(len)?;
            rest = behind;
            let end = piece.last().unwrap_or(first).end;
            Some(([first].into_iter().chain(piece).flat_map(Column::points).collect(), end))
        })
    }

    /// Place and number of the values of each column.
    pub(super) fn counts(&self) -> impl Iterator<Item = (u64, u64)> {
        self.columns.iter().map(|column| (column.first.x, column.count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(columns: &Columns) -> Vec<Point> {
        columns.pieces().flatten().collect()
    }

    #[test]
    fn a_short_curve_is_kept_as_it_is() {
        let mut columns = Columns::default();
        for (x, y) in [(1, 5.0), (2, -1.0), (2, 7.0), (2, 0.0), (9, 3.0)] {
            columns.push(x, y);
        }
        let expected = [(1, 5.0), (2, -1.0), (2, 7.0), (2, 0.0), (9, 3.0)];
        assert_eq!(points(&columns), expected.map(|(x, y)| Point { x, y }));
        assert_eq!((columns.width(), columns.count()), (1, 5));
        assert_eq!(columns.range(), Some((-1.0, 7.0)));
    }

    #[test]
    fn a_long_curve_keeps_its_ends_and_every_peak_in_bounded_memory() {
        let mut columns = Columns::default();
        let len = 1_000_000;
        for x in 0..len {
            let peak = if x == 123_456 { 99.0 } else { 0.0 };
            columns.push(x * 250, peak + (x % 7) as f64);
        }
        let points = points(&columns);
        assert!(columns.columns.len() <= MOST && columns.columns.capacity() <= 2 * (MOST + 1));
        assert!(columns.columns.len() > MOST / 2 - 2, "{}", columns.columns.len());
        assert!(points.len() <= 4 * MOST);
        assert_eq!(columns.count(), len);
        assert_eq!(columns.range(), Some((0.0, 99.0 + (123_456 % 7) as f64)));
        let ends = [points[0].x, points[points.len() - 1].x];
        assert_eq!(ends, [0, (len - 1) * 250]);
        assert!(points.is_sorted_by_key(|point| point.x));
        // Each column has what is lowest and highest in it.
        let width = columns.width();
        for column in &columns.columns {
            let xs = (column.key * width..(column.key + 1) * width).filter(|x| x % 250 == 0);
            let ys = xs.map(|x| x / 250).filter(|x| *x < len && *x != 123_456);
            let high = ys.map(|x| x % 7).max().unwrap();
            assert!(column.high.y as u64 == high || column.high.y > 90.0, "{column:?}");
        }
    }

    #[test]
    fn an_interruption_and_a_value_that_is_not_finite_end_a_piece() {
        let mut columns = Columns::default();
        columns.cut();
        for (x, y) in [(1, 1.0), (2, 2.0), (3, f64::NAN), (4, 4.0)] {
            columns.push(x, y);
        }
        columns.cut();
        columns.push(5, f64::INFINITY);
        columns.push(6, 6.0);
        let pieces: Vec<Vec<u64>> =
            columns.pieces().map(|piece| piece.iter().map(|point| point.x).collect()).collect();
        assert_eq!(pieces, [vec![1, 2], vec![4], vec![6]]);
    }

    #[test]
    fn what_ends_a_held_value_is_no_value() {
        let mut columns = Columns::default();
        columns.end(1);
        columns.push(2, 7.0);
        columns.end(5);
        columns.end(6);
        columns.push(8, 9.0);
        let pieces: Vec<_> = columns.pieces_and_ends().collect();
        let piece = |x, y| vec![Point { x, y }];
        assert_eq!(pieces, [(piece(2, 7.0), Some(5)), (piece(8, 9.0), None)]);
        assert_eq!(columns.count(), 2);
    }

    #[test]
    fn times_that_go_backwards_are_put_where_they_belong() {
        let mut columns = Columns::default();
        for x in [5, 1, 3, 3, 9, 2] {
            columns.push(x, x as f64);
        }
        let xs: Vec<_> = points(&columns).iter().map(|point| point.x).collect();
        assert_eq!(xs, [1, 2, 3, 5, 9]);
        assert_eq!(columns.count(), 6);
    }
}
