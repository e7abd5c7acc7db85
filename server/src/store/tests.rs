//! The log's promises: durable, ordered, without gaps, and each race decided once.

use super::*;

async fn open(folder: &tempfile::TempDir) -> Store {
    Store::open(&path(folder).into(), "1", &Limits::default()).await.unwrap()
}

fn path(folder: &tempfile::TempDir) -> std::path::PathBuf {
    folder.path().join("log.db")
}

impl Store {
    /// Creates a session with its first event.
    async fn begin(&self, session_id: &str, first: Event) -> Result<(), StoreError> {
        self.create(session(session_id, &first), vec![first]).await
    }

    /// Appends an event after the newest one.
    async fn add(&self, session_id: &str, event: Event) -> Result<(), StoreError> {
        let row = self.session(session_id).await?.ok_or(StoreError::Conflict)?;
        let before = row.link.unwrap().try_into().unwrap();
        self.append(head(session_id, &event, &before), before, event).await
    }
}

fn head(session_id: &str, event: &Event, before: &Link) -> SessionHead {
    let (session_id, summary, link) = (session_id.into(), b"summary".to_vec(), event.link(before));
    SessionHead { session_id, created_us: 7, state: 1, summary, link, new_labels: None }
}

fn session(session_id: &str, first: &Event) -> NewSession {
    let labels = [("object".to_owned(), session_id.to_owned())].into();
    let head = head(session_id, first, &first_link(session_id));
    NewSession {
        head,
        experiment: "bench".into(),
        labels,
        imported_by: None,
        owner: None,
        reference_of: None,
    }
}

fn event(seq: i64, request_id: &str) -> Event {
    Event {
        seq,
        request_id: Some(request_id.into()),
        request_digest: vec![1],
        kind: "contact_result".into(),
        payload: vec![0, 255, 3],
        reply: format!("reply to {request_id}").into_bytes(),
        state_hash: "ab".into(),
        stats_after: Vec::new(),
        algorithm_version: "1".into(),
        append_us: 11,
        actor: String::new(),
    }
}

#[tokio::test]
async fn what_was_acknowledged_is_there_after_reopening() {
    let folder = tempfile::tempdir().unwrap();
    let store = open(&folder).await;
    store.begin("mug", event(1, "a")).await.unwrap();
    store.add("mug", event(2, "b")).await.unwrap();
    // Not closed, and opened while it is held still: as near to a kill as one process can come.
    let store = Store::open_beside(&path(&folder), &Limits::default()).await.unwrap();
    let events = store.events("mug", 0, 10).await.unwrap();
    assert_eq!(events.iter().map(|event| event.seq).collect::<Vec<_>>(), [1, 2]);
    assert_eq!(events[1].payload, [0, 255, 3]);
    assert_eq!(store.session("mug").await.unwrap().unwrap().head, 2);
    let first = store.first_under("mug", "b").await.unwrap().unwrap();
    assert_eq!((first.request_digest, first.reply), (vec![1], b"reply to b".to_vec()));
}

#[tokio::test]
async fn of_two_writers_of_one_seq_one_wins() {
    let folder = tempfile::tempdir().unwrap();
    // Two stores on one file stand for two processes.
    let one = open(&folder).await;
    let other = Store::open_beside(&path(&folder), &Limits::default()).await.unwrap();
    one.begin("mug", event(1, "a")).await.unwrap();
    let (first, second) = tokio::join!(one.add("mug", event(2, "b")), other.add("mug", event(2, "c")));
    assert_eq!(usize::from(first.is_ok()) + usize::from(second.is_ok()), 1);
    assert_eq!(one.events("mug", 0, 10).await.unwrap().len(), 2);
}

#[tokio::test]
async fn a_conflict_undoes_one_change_and_not_its_group() {
    let folder = tempfile::tempdir().unwrap();
    let store = open(&folder).await;
    store.begin("mug", event(1, "a")).await.unwrap();
    let outcomes = tokio::join!(
        store.begin("can", event(1, "c")),
        store.add("mug", event(5, "gap")),
        store.add("mug", event(2, "a")),
        store.add("mug", event(2, "b")),
        store.add("pot", event(2, "no such session")),
    );
    assert!(outcomes.0.is_ok() && outcomes.3.is_ok());
    for refused in [outcomes.1, outcomes.2, outcomes.4] {
        assert!(matches!(refused, Err(StoreError::Conflict)));
    }
    assert_eq!(store.session("mug").await.unwrap().unwrap().head, 2);
}

#[tokio::test]
async fn many_writers_share_commits_and_lose_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let store = std::sync::Arc::new(open(&folder).await);
    let writers: Vec<_> = (0..64)
        .map(|number| {
            let store = store.clone();
            tokio::spawn(async move {
                let id = format!("session-{number}");
                store.begin(&id, event(1, &id)).await.unwrap();
                for seq in 2..6 {
                    store.add(&id, event(seq, &format!("r{seq}"))).await.unwrap();
                }
            })
        })
        .collect();
    for writer in writers {
        writer.await.unwrap();
    }
    assert_eq!(store.session_count().await.unwrap(), 64);
    for number in 0..64 {
        assert_eq!(store.events(&format!("session-{number}"), 0, 10).await.unwrap().len(), 5);
    }
}

#[tokio::test]
async fn events_cannot_be_changed_or_removed_but_with_their_session() {
    let folder = tempfile::tempdir().unwrap();
    let store = open(&folder).await;
    store.begin("mug", event(1, "a")).await.unwrap();
    let mut direct = open::writer(&folder.path().join("log.db")).await.unwrap();
    assert!(sqlx::query("update events set payload = x'00'").execute(&mut direct).await.is_err());
    assert!(sqlx::query("delete from events").execute(&mut direct).await.is_err());
    let deletion = Deletion {
        session_id: "mug".into(),
        created_us: 7,
        head: Some(1),
        request: Some(("d".into(), vec![2])),
    };
    store.delete(deletion).await.unwrap();
    assert!(store.events("mug", 0, 10).await.unwrap().is_empty());
    assert_eq!(store.deleted_by("mug", "d").await.unwrap(), Some(vec![2]));
}

#[tokio::test]
async fn a_full_disk_is_told_apart_and_forgotten_once_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    let path = path(&folder);
    let mut opened = open::open(&path).await.unwrap();
    // A bound on the file stands for one on the disk.
    let pages: i64 = sql("pragma page_count").scalar(&mut opened.connection).await.unwrap().unwrap();
    let bound = format!("pragma max_page_count = {}", pages + 12);
    sql(bound).execute(&mut opened.connection).await.unwrap();
    let store = Store::over(opened, open::readers(&path).await.unwrap(), "1", &Limits::default());
    store.begin("mug", event(1, "a")).await.unwrap();
    let large = Event { payload: vec![7; 200_000], ..event(2, "b") };
    assert!(matches!(store.add("mug", large).await, Err(StoreError::Full)));
    assert!(matches!(store.check_writable().await, Err(StoreError::Full)), "it is not ready");
    assert_eq!(store.session("mug").await.unwrap().unwrap().head, 1, "readers go on");
    assert!(store.events("mug", 1, 10).await.unwrap().is_empty());
    store.close().await;

    let store = open(&folder).await;
    store.add("mug", event(2, "b")).await.unwrap();
    store.check_writable().await.unwrap();
}

#[tokio::test]
async fn lists_are_filtered_and_paged_newest_first() {
    let folder = tempfile::tempdir().unwrap();
    let store = open(&folder).await;
    for (id, created_us) in [("aaa", 1), ("bbb", 2), ("ccc", 2)] {
        let first = event(1, id);
        let mut new = session(id, &first);
        new.head.created_us = created_us;
        store.create(new, vec![first]).await.unwrap();
    }
    let ids = |rows: &[SessionRow]| rows.iter().map(|row| row.session_id.clone()).collect::<Vec<_>>();
    let all =
        Filter { experiment: Some("bench".into()), state: Some(StateFilter::Is(1)), ..Filter::default() };
    let page = store.list(&all, None, 2).await.unwrap();
    assert_eq!(ids(&page), ["ccc", "bbb"]);
    assert_eq!(ids(&store.list(&all, Some(&page[1].page_end()), 2).await.unwrap()), ["aaa"]);
    let labelled = Filter { labels: [("object".into(), "bbb".into())].into(), ..Filter::default() };
    assert_eq!(ids(&store.list(&labelled, None, 9).await.unwrap()), ["bbb"]);
    let elsewhere = Filter { experiment: Some("other".into()), ..Filter::default() };
    assert!(store.list(&elsewhere, None, 9).await.unwrap().is_empty());
}

#[tokio::test]
async fn a_request_id_creates_one_session_which_is_found_by_it() {
    let folder = tempfile::tempdir().unwrap();
    let store = open(&folder).await;
    store.begin("one", event(1, "a")).await.unwrap();
    assert!(matches!(store.begin("two", event(1, "a")).await, Err(StoreError::Conflict)));
    assert_eq!(store.created_by("one", "a").await.unwrap().unwrap().session_id, "one");
    assert!(store.session("two").await.unwrap().is_none(), "the losing creation left nothing behind");
    store.check_writable().await.unwrap();
    store.close().await;
    assert!(store.check_writable().await.is_err());
    assert!(!folder.path().join("log.db-wal").exists(), "a closed log is one file");
}
