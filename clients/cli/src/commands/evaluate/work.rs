//! Makes the runs, some at once; each is written down as it ends.

use std::collections::VecDeque;
use std::num::NonZeroUsize;

use indicatif::{ProgressBar, ProgressStyle};
use palpate_client::proto::v1::DeleteSessionRequest;
use palpate_client::{Client, Code, Error as ClientError};
use tokio::task::JoinSet;

use super::cases::Task;
use super::journal::Journal;
use super::run;
use crate::failure::{Ended, Failure};
use crate::terminal::{say, warn};

/// Makes every run that is not finished, and tells how many failed.
///
/// # Errors
/// Ctrl-C, a reader that has gone, or a file that cannot be written; what has ended before is kept.
pub(super) async fn work(
    client: &Client,
    tasks: Vec<Task>,
    finished: &[String],
    jobs: Option<NonZeroUsize>,
    journal: &mut Journal,
) -> Result<usize, Failure> {
    let bar = ProgressBar::new(tasks.len() as u64);
    bar.set_style(ProgressStyle::with_template("{bar:15} {pos}/{len} runs, {eta} left")?);
    let mut left: VecDeque<Task> =
        tasks.into_iter().filter(|task| !finished.iter().any(|id| id == task.session_id())).collect();
    bar.set_position(finished.len() as u64);
    bar.reset_eta();
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let jobs = jobs.map_or(cores, NonZeroUsize::get);

    let mut failed = 0;
    let mut running = JoinSet::new();
    // Listened for all the time: what comes while a run is written down is not lost.
    let mut interrupted = std::pin::pin!(tokio::signal::ctrl_c());
    loop {
        while running.len() < jobs
            && let Some(task) = left.pop_front()
        {
            running.spawn(one(client.clone(), task));
        }
        // Whatever is still running is given up with the set.
        let ended = tokio::select! {
            ended = running.join_next() => ended,
            interrupted = &mut interrupted => {
                interrupted?;
                bar.finish_and_clear();
                tokio::spawn(end_at_once_when_interrupted_again());
                return Err(Ended::Interrupted(String::new()).into());
            }
        };
        let Some(ended) = ended else { break };
        let (case, result) = ended?;
        bar.inc(1);
        match result {
            Ok(run) => {
                journal.add(&run)?;
                if bar.is_hidden() {
                    say(format_args!("{case}: {:.2} mm", 1e3 * run.last.surface_distance_m))?;
                }
            }
            Err(failure) => {
                failed += 1;
                bar.suspend(|| warn(format_args!("{case} failed: {failure}")));
            }
        }
    }
    bar.finish_and_clear();
    Ok(failed)
}

/// Whoever does not want to wait for the report need not.
async fn end_at_once_when_interrupted_again() {
    if tokio::signal::ctrl_c().await.is_ok() {
        std::process::exit(130);
    }
}

async fn one(client: Client, task: Task) -> (String, Result<super::record::Run, Failure>) {
    let name = task.case.to_string();
    let result = async {
        remove_cut_off(&client, task.session_id()).await?;
        run::run(client.clone(), task).await
    };
    (name, result.await)
}

/// A session of this name was begun by a run that was cut off, and is made anew.
async fn remove_cut_off(client: &Client, session_id: &str) -> Result<(), Failure> {
    let request =
        DeleteSessionRequest { session_id: session_id.to_owned(), ..DeleteSessionRequest::default() };
    match client.delete_session(request).await {
        Err(ClientError::Refused(refusal)) if refusal.code == Code::NotFound => Ok(()),
        deleted => Ok(deleted?),
    }
}

#[cfg(test)]
mod tests {
    use palpate_client::proto::v1::{Method, Strategy};

    use super::super::super::robot::LocalServer;
    use super::super::folder::Folder;
    use super::super::tests::typed;
    use super::super::{cases, objects};
    use super::*;

    #[tokio::test]
    async fn a_run_that_fails_is_counted_and_the_others_go_on() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = Folder::prepare(temporary.path(), false).unwrap();
        let (server, client) = LocalServer::start(&folder.database()).await.unwrap();
        let what = ["--methods", "palpate", "--strategies", "random", "--seeds", "3", "--attempts", "2"];
        let objects = objects::load(None, 1.0, &["ball".to_owned()]).unwrap();
        let mut tasks = cases::tasks(&objects, &typed(&what));
        let order: Vec<_> = tasks.iter().map(|task| task.session_id().to_owned()).collect();
        // The server refuses this strategy of this method.
        let config = tasks[1].plan.session.config.as_mut().unwrap();
        config.set_method(Method::Paper);
        config.set_strategy(Strategy::ExpectedGain);
        let (mut journal, finished) = Journal::open(&folder).unwrap();
        let failed = work(&client, tasks, &finished, None, &mut journal).await.unwrap();
        server.stop().await.unwrap();
        assert_eq!(failed, 1);
        let kept: Vec<_> = journal.close(&order).unwrap().into_iter().map(|run| run.session_id).collect();
        assert_eq!(kept, ["run-0001", "run-0003"]);
    }
}
